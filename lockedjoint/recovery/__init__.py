"""After a failure: a trajectory that still reaches the goal, or a proof that there is none."""
