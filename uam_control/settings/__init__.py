"""Parameter sets, YAML files and the location of config/."""
