"""Every threshold of the grid's matcher, in one record."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class MatcherSettings:
    """How an image's nodes are found, linked, assigned to the pattern's, and unwrapped.

    A period is one of the grid's. Evidence is the natural logarithm of a likelihood ratio: what
    the pattern asks for over chance. Sources: *by hand* means set when the rule was written and
    judged by the wrong periods and the coverage of ``scripts/benchmark.py --only decoder``, without
    a search; *chance*, *geometry* and *study* are told in the field.
    """

    phase_smoothing: float = 1.0
    """Pixels, standard deviation of the phase's average. Geometry: far below a period, above the
    network's noise from pixel to pixel."""

    # Nodes
    node_confidence: float = 0.3
    """Probability. By hand: lower than a pixel's, since a node is told by its links as well."""
    node_phase: float = 0.25
    """Periods from a pixel to its node. Geometry: beyond, it may be the neighbouring node."""
    node_reach: float = 0.75
    """Pixels from a node to the nearest pixel's middle. Geometry: half the diagonal of a pixel,
    with room for the slope's error."""
    node_spacing: int = 5
    """Pixels, side of the window that holds one node. Geometry: below the least period trained."""
    period_range: tuple[float, float] = (3.0, 60.0)
    """Pixels a period may take in the image. By hand: beyond what the network was trained on."""

    # Links
    link_reach: float = 0.35
    """Periods by which a neighbour may miss its predicted place. By hand."""
    link_phase_error: float = 0.2
    """Periods by which the phase's integral along a link may miss its due. By hand."""
    link_edge: float = 0.8
    """Probability of a depth edge on a link, at most. By hand."""
    link_confidence: float = 0.3
    """Mean probability along a link. By hand: low, because a highlight may lie on it."""
    link_samples: int = 13
    """Points along a link. Geometry: a twelfth of a period apart."""
    link_jump: float = 0.35
    """Periods between neighbouring points that make a jump. By hand: four times their distance."""

    # Codes
    misread: float = 0.1
    """Probability that a code is read wrong for reasons the network does not see. By hand."""
    outside: float = -1.5
    """Evidence of a node that would lie outside the pattern. By hand."""
    window: int = 6
    """Nodes along a window's side. Study: the prototype's, with the cut heavily corrupted images'
    wrong periods fell from 4.2 to 0.7 %."""
    window_nodes: int = 20
    """Nodes in a window, of 36. By hand."""
    window_evidence: float = 0.4
    """Evidence per node. By hand: a right window has about 1, of at most log(2.8)."""
    window_margin: float = 2.5
    """Evidence over the window's next best offset. By hand."""
    window_offsets: int = 12
    """Offsets taken from the windows of a component. By hand."""

    # Assignment
    part_nodes: int = 9
    """Nodes of the least part that is assigned. Chance: one 3 x 3 neighbourhood is unique."""
    part_evidence: float = 0.3
    """Evidence per node of a part, if all of it is less than ``certain``. By hand."""
    part_margin: float = 6.0
    """Evidence of a part over its next best offset. By hand."""
    certain: float = 12.0
    """Evidence, and margin, that needs no mean. Chance: one offset reaches s with probability
    exp(-s) at most (Markov's inequality for likelihood ratios), and there are some 6,000."""
    period_errors: tuple[int, int] = (3, 1)
    """Columns and rows by which the other side of a fold is often off. By hand, on colons."""
    component_share: float = 0.4
    """Of a component's nodes that must be assigned, or none is. Study: grids with another code,
    mirrored or turned were accepted at 14 to 20 % without it, and at 0 % with it."""
    total_share: float = 0.25
    """Of all components' nodes, likewise. By hand: of many small components in a grid with another
    code, one or two fit by chance as a whole."""
    large_part: int = 60
    """Nodes of a part that is accepted whatever the shares. Study: as ``component_share``."""
    cut_evidence: float = 2.0
    """Evidence, price of a link between two offsets. Study: 1.5 and 3 leave more wrong periods."""
    cut_least: float = 0.2
    """Share of that price for the worst link. By hand."""
    chance_evidence: float = 0.1
    """Evidence per node under which a part is left out although links lead there. Study: right
    parts of badly corrupted images have about 0.3, chance gives less than 0."""
    cut_rounds: int = 40
    """Rounds of belief propagation. By hand: some 30 nodes from side to side."""
    cut_damping: float = 0.5
    """Share of the old message that is kept. By hand: loops oscillate without it."""
    near_periods: float = 3.0
    """Periods to the assigned node that predicts a small component's place. By hand."""
    near_evidence: float = 0.2
    """Evidence per node of a small component. By hand."""
    near_margin: float = 3.0
    """Evidence of all its nodes, and over the next best offset. By hand."""
    context_links: int = 3
    """Links from a node to those that speak for it: some two dozen. Study, twelve heavily corrupted
    colons: fewer are outvoted by misreadings, more by the rest of a part beyond a fold."""
    single_links: int = 2
    """Links in a row, in no closed quad, that lead to a node. By hand."""
    single_quality: float = 0.5
    """Quality of such a link. By hand: no quad confirms it."""
    single_evidence: float = 0.2
    """Evidence of the node's own code. By hand: about half as probable again as by chance."""

    # Unwrapping
    pixel_confidence: float = 0.5
    """Probability. Study, twelve heavily corrupted colons: more likely right than not."""
    pixel_edge: float = 0.8
    """Probability of a depth edge, at most. By hand."""
    pixel_slope: float = 0.25
    """Periods per pixel. Geometry: where the pattern is more crowded, pixels mix several lines."""
    region_step: float = 0.3
    """Periods by which the phase may differ between neighbouring pixels of a surface. By hand."""
    spread_rounds: int = 2
    """Regions without a node are reached from others in so many steps. By hand."""
    spread_share: float = 0.8
    """Of the border to other regions that must ask for the same fringe order. By hand."""
    conflict_margin: int = 4
    """Pixels left out around regions whose fringe orders contradict each other. By hand."""
    plane_sigma: float = 4.0
    """Pixels, standard deviation of the fit's window. Geometry: under half a period. Study: 5 is
    better for heavily corrupted colons and worse for clean ones."""
    plane_confidence: tuple[float, float] = (0.7, 0.95)
    """Probability from which down the plane alone counts, and from which up the pixel alone.
    Study: with 0.8 to 0.98 likewise."""
    plane_residual: float = 0.3
    """Periods, standard deviation off the plane in a window: more is a fold. By hand."""
    plane_change: float = 0.25
    """Periods by which a plane may change a pixel. By hand."""
    plane_ridge: float = 1e-3
    """Share of the window's variance that steadies slopes where pixels are few. By hand."""

    # Result
    neighbour_slack: float = 0.125
    """Periods by which a right pixel may miss its neighbours' coordinate. By hand."""
    least_nodes: int = 9
    """Nodes with links, under which an image shows no grid. Chance: as ``part_nodes``."""
    least_doubt: float = 1e-3
    """One less the confidence, under which coordinates are no better known. Study, the training's
    clean validation views: 0.09 pattern pixels there and below."""
    dark: float = 8 / 255
    """Of full scale: an image whose brightest hundredth is below it is called dark. By hand."""
    brightest: float = 0.99
    """Quantile of the brightness that tells a dark image: glints are fewer pixels. By hand."""
    saturated: float = 254.5 / 255
    """Of full scale. Geometry: the last grey level of 8 bits."""

    def offset_errors(self) -> list[tuple[int, int]]:
        """Return the columns and rows of ``period_errors``, each by each, (0, 0) included."""
        columns, rows = self.period_errors
        return [(x, y) for x in range(-columns, columns + 1) for y in range(-rows, rows + 1)]
