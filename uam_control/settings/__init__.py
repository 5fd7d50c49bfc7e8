"""Parameter sets, YAML files, the location of config/, and atomic writing."""
