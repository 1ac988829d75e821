"""Sets every number and every statement of the article against what was computed."""
