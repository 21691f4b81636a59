"""The atlas: the best Jacobian known of every kind of arm, proved, beside the bounds."""
