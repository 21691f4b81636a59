"""How near the links of a robot are to each other."""
