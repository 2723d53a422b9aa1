"""One loop bench: friction compensation before and after, how much of it to dare on drives that are
not exactly the model, and friction observers at equal terms."""
