"""The blocks: one pure function each, registered by one line."""
