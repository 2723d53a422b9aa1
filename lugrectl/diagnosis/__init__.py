"""The main job on a user's logs: diagnose, and identify the declared model alone."""
