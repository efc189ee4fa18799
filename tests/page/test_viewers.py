"""Two persons look at one simulator: one drives at a time, both see it, and the simulator may go and come back."""

from __future__ import annotations

import urllib.error
import urllib.request

from tests.page.conftest import Visitor, free_port, run
from tests.page.visits import PATIENCE, Served, Visit


def seen_x(visit: Visit) -> float:
    """Where that page sees the first car [m]."""
    return visit.knows("store.frame.value.vehicles.V1.pose.position[0]")


def test_one_of_two_viewers_drives_and_the_other_sees_it_and_is_told(plane: Served, visitor: Visitor) -> None:
    ada, bob = (visitor().go(plane.url + "?quality=low") for _ in range(2))
    ada.until(lambda: ada.knows("store.status.value.viewers") == 2)
    ada.page.keyboard.down("w")
    bob.until(lambda: seen_x(bob) > 0.3)
    ada_is = ada.knows("store.welcome.value.name")
    bob.until(lambda: bob.knows("store.status.value.drivers") == {"V1": ada_is})
    bob.page.keyboard.down("s")
    bob.until_text("notices", f"'{ada_is}' drives vehicle 'V1'")
    assert plane.vehicle.throttle > 0
    bob.page.keyboard.up("s")
    ada.page.keyboard.up("w")
    ada.until(lambda: plane.vehicle.throttle == 0)
    bob.press("menu-button")
    before = plane.frame.time
    bob.press("reset")
    bob.until(lambda: plane.frame.time < before)
    for one in (ada, bob):
        one.until(lambda one=one: seen_x(one) < 0.05 and one.knows("store.frame.value.time") < before)
        assert one.knows("store.link.value") == "open"
    bob.until(lambda: not bob.knows("store.status.value.drivers"))
    bob.page.keyboard.down("w")  # now he may
    bob.until(lambda: plane.vehicle.speed > 0.05)
    bob.page.keyboard.up("w")


def test_page_takes_up_its_work_when_the_simulator_is_killed_and_started_again(visitor: Visitor, built: object) -> None:
    port = free_port()
    visit = visitor(expects="ERR_CONNECTION")
    url = f"http://127.0.0.1:{port}/?quality=low"
    with run("plane", port=port) as process:
        visit.until(lambda: is_served(url) or process.poll() is not None)
        visit.go(url)
        drive(visit)
        assert not visit.get("banner").is_visible()
        visit.page.keyboard.down("w")
        process.kill()
        visit.get("banner").wait_for(state="visible")
        visit.until_text("banner", "Reconnecting")
        visit.page.keyboard.up("w")
    with run("plane", port=port):
        visit.get("banner").wait_for(state="hidden", timeout=1000 * PATIENCE)
        visit.until(lambda: abs(seen_x(visit)) < 0.05)  # another world
        assert visit.knows("store.frame.value.vehicles.V1.throttle") == 0
        drive(visit)
        visit.until_drawn()


def test_page_with_the_token_works_and_without_it_is_refused_in_plain_words(visitor: Visitor, built: object) -> None:
    port = free_port()
    bare = f"http://127.0.0.1:{port}/"
    with run("plane", "--token", "open-sesame", port=port):
        visit = visitor(expects="403")
        visit.until(lambda: is_served(bare))
        for url in (bare, f"{bare}?token=wrong"):
            answer = visit.page.goto(url)
            assert answer is not None
            assert answer.status == 403
            assert answer.headers["content-type"].startswith("text/plain")
            assert "token" in (visit.page.text_content("body") or "")
        visit.go(f"{bare}?token=open-sesame&quality=low")
        visit.until_drawn()
        drive(visit)


def drive(visit: Visit) -> None:
    """Until the page sees the car move on."""
    before = seen_x(visit)
    visit.page.keyboard.down("w")
    visit.until(lambda: seen_x(visit) > before + 0.05)
    visit.page.keyboard.up("w")
    visit.until(lambda: visit.knows("store.frame.value.vehicles.V1.throttle") == 0)


def is_served(url: str) -> bool:
    """Whether somebody answers there."""
    try:
        urllib.request.urlopen(url, timeout=PATIENCE).close()
    except urllib.error.HTTPError:
        return True
    except (urllib.error.URLError, ConnectionError):
        return False
    return True
