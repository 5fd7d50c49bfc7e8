"""The stages of a control tick: plain objects that the nodes and the direct engine share."""
