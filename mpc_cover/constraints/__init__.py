"""One constraint a file, each a set of half-spaces."""
