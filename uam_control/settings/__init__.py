"""Parameter sets, YAML files and the place of config/."""
