"""How well tags are detected: the measured map of detection error, and frames with the detected tags drawn in."""
