"""``results/``, regenerated: the studies, each a folder, and the page in front of them."""
