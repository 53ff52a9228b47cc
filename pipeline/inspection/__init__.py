"""What is asked of a checkout, a machine or results, without making any."""
