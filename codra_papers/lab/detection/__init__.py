"""Detection quality: the measured map of detection error, and frames with the detected tags drawn into them."""
