"""Model selection: the law and its terms with the smallest cross-validation error over motions."""
