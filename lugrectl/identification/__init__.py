"""From a log to the values of a model, and to what the model does not explain."""
