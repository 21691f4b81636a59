"""What failures leave of the workspace, and the artificial limits that keep the most."""
