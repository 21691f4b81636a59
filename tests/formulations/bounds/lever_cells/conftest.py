"""One thread for small matrices."""

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(autouse=True, scope="package")
def one_blas_thread():
    """Many small matrices: with busy cores a second thread costs more than it saves."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield
