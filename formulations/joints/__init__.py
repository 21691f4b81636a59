"""What a joint can contribute to a Jacobian, and the arm that joints make."""
