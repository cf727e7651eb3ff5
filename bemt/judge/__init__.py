"""Where model and recording differ: what changed, which physics was left out, and how often that is right."""
