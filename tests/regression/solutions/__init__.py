"""Solutions of regression cases that do not come from spurflex: references that cannot share its mistakes."""
