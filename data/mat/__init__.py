"""MATLAB's MAT-files of version 5 (`save -v6`, `save -v7`): elements, the arrays in them, and columns."""
