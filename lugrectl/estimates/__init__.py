"""What a fit and a diagnosis find: values with intervals, effects, tables, covariances."""
