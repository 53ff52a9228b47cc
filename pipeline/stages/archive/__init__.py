"""Archives: boundaries of rocks that nobody scanned, and the equations that give them."""
