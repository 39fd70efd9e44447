"""northdown: attitude and heading from inertial and magnetic sensors."""

__version__ = "0.1.0"
