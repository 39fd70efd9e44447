"""The command line: one command to a file; `main` dispatches.

A command's module imports only what its options need. Whatever is slow to load (numba, pandas, matplotlib) is
imported inside the functions that use it, so that ``northdown --help`` answers at once.

Standard output carries what was asked for; warnings, progress and errors go to standard error. Exit codes: 0
success, 1 a defect of northdown, 2 a mistake in the data or in the command, 130 interrupted.
"""
