"""`python -m mpc_cover` is `mpc-cover`."""

from mpc_cover.cli import main

if __name__ == "__main__":
    main()
