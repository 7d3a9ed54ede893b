"""A plugin of pytest: of each file only the first test that is chosen."""

import pytest


@pytest.hookimpl(trylast=True)  # after -m
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items[:] = reversed({item.path: item for item in reversed(items)}.values())
