"""What changed between two recordings, and one run beside the model."""
