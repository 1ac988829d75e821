"""Other solvers on the equations of spurflex: heyoka, CVODE of SUNDIALS, and SciPy."""
