"""Several and unequal failures: the best found beside the bound, over a list of cases."""
