"""mpc-cover: receding-horizon area coverage by a fleet of mobile sensors."""

from importlib.metadata import version as _version

__version__ = _version("mpc-cover")
