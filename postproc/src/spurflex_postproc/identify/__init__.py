"""Derives the parameters that the article does not print from the features that it does."""
