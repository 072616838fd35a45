"""From one image of the coded grid to projector coordinates: network, graph, code, phase."""
