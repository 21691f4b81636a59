"""Unit tight frames by cells: no isotropic 7R arm has lever arms within a limit."""
