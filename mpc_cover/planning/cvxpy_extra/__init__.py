"""Terms and constraints of a user's own, written in CVXPY: `plan --formulation cvxpy --extra module:function`."""
