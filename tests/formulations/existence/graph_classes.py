"""Which classes of coloured graphs there are: what tests of the equations look through."""

from lockedjoint.formulations.existence.equations import Monomial, canonical, coloured_graphs


def classes(joints: int, order: int, *, loops: bool = False) -> tuple[Monomial, ...]:
    """Return one monomial for each class with up to `order` edges of each colour, 1 first."""
    found = {
        canonical(graph)
        for edges in range(order + 1)
        for graph in coloured_graphs(joints, edges, edges, loops)
    }
    return tuple(sorted(found, key=lambda graph: (graph.degree, graph)))
