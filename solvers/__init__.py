"""QP back-ends and sequential quadratic programming; knows nothing of coverage."""
