"""What loops are worth: four managers in the same shop."""
