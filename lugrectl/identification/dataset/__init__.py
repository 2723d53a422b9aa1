"""A record laid out for estimation: windows, sensor noise, folds."""
