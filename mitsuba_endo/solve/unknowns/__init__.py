"""What is unknown: the values, which frames share them, and steps of them."""
