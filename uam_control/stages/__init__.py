"""The stages of a control tick: plain objects, shared by the nodes and the direct engine."""
