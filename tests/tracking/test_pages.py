"""MLflow's pages, as a person sees them in a browser."""

import pytest
from browser import OpenPage, Visit
from mlflow import MlflowClient
from playwright.sync_api import expect
from tracked_project import AGGREGATES, OnServer

from jumping_ant.tracking import pages


@pytest.fixture(scope="module")
def address(on_server: OnServer) -> str:
    return on_server.address


def check(visit: Visit, address: str) -> None:
    """Nothing broke, and nothing was asked of anyone else."""
    assert visit.page_errors == []
    assert [request for request in visit.requests if not request.startswith(address)] == []


def test_a_link_leads_to_the_table_with_the_columns_that_matter(
    address: str, open_page: OpenPage
) -> None:
    usual = open_page(f"{address}/#/experiments/1/runs")
    with usual.page.expect_popup() as popup:
        usual.page.get_by_role("link", name="Table of results").click()
    expect(popup.value.get_by_role("button", name=pages.VIEW_NAME)).to_be_visible()
    visit = open_page(f"{address}/{pages.address('1')}")
    for name in AGGREGATES:
        expect(visit.page.get_by_role("link", name=name)).to_be_visible()
    expect(visit.page.get_by_role("link", name="sac-seed-0")).to_have_count(0)
    row = visit.page.get_by_role("row").filter(has_text=AGGREGATES[0])
    index = row.first.get_attribute("row-index")  # a row comes in parts, pinned and scrolling
    cells = visit.page.locator(f"[role=row][row-index='{index}'] [role=gridcell]")
    read = "cells => cells.map(cell => [cell.getAttribute('col-id'), cell.innerText])"
    texts = dict(cells.evaluate_all(read))
    assert [texts[name] for name in pages.COLUMNS[:5]] == ["sac", "65", "15", "115", "15"]
    check(visit, address)


def test_a_comparison_shows_its_results(address: str, open_page: OpenPage) -> None:
    (run,) = MlflowClient(address).search_runs(["1"], "attributes.run_name LIKE 'comparison%'")
    visit = open_page(f"{address}/#/experiments/1/runs/{run.info.run_id}")
    expect(visit.page.get_by_role("cell", name="65 [15, 115]").first).to_be_visible()
    expect(visit.page.get_by_text("SAC leads")).to_be_attached()
    visit.page.get_by_role("tab", name="Artifacts").click()
    for name in ("comparison.json", "params.yaml", "figures"):
        expect(visit.page.get_by_text(name, exact=True).first).to_be_visible()
    check(visit, address)


def test_the_registry_shows_the_champion_and_where_it_is_from(
    address: str, open_page: OpenPage
) -> None:
    visit = open_page(f"{address}/#/models/jumping-ant-sac/versions/2")
    expect(visit.page.get_by_text("champion")).to_be_visible()
    note = "sac, training seed 1: mean return 115 on the held-out"
    expect(visit.page.get_by_text(note)).to_be_visible()
    visit.page.get_by_role("link", name="sac-seed-1").nth(1).click()
    expect(visit.page.get_by_text("evaluation/return").first).to_be_attached()
    check(visit, address)
