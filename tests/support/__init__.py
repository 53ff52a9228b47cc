"""What several tests share: shapes, grounds, files and falls made up for them."""
