"""The main job: all formulations from common starts, side by side in one table."""
