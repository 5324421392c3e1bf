"""Tasks on a Dask cluster: addresses that are refused, and the same rows as on this machine's processes."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess

import pytest

from shake_ros.campaigns.batches import Task, function_of, run
from shake_ros.campaigns.engine import check_address, engine
from shake_ros.quantities import ShakeError

HERE = importlib.util.find_spec("distributed") is not None
without = pytest.mark.skipif(not HERE, reason="distributed is not installed: pip install 'shake_ros[cluster]'")


def needs_dask(test):
    """A test of the second tier, skipped where Dask is not installed."""
    return pytest.mark.second_tier(without(test))


@pytest.mark.parametrize(
    "address", ["tls://10.0.0.5:8786", "tcp://127.0.0.1:8786", "tcp://[::1]:1", "tcp://localhost:1"]
)
def test_encrypted_addresses_and_those_of_this_machine_are_taken(address):
    check_address(address)


@pytest.mark.parametrize(
    "address",
    ["tcp://10.0.0.5:8786", "tcp://example.org:8786", "tcp://localhost.example.org:1", "tcp://0.0.0.0:8786"],
)
def test_unencrypted_addresses_of_other_machines_are_refused(address):
    with pytest.raises(ShakeError, match="not encrypted"):
        check_address(address)


@pytest.mark.parametrize(
    "address", ["8786", "http://a:1", "tls://a", "tls://:1", "tls://a:b", "tls://a:1/x", "ucx://a:1"]
)
def test_what_is_no_address_is_refused(address):
    with pytest.raises(ShakeError, match="neither"):
        check_address(address)


@pytest.mark.skipif(HERE, reason="distributed is installed")
def test_where_dask_is_not_installed_a_line_says_what_to_install():
    with pytest.raises(ShakeError, match=r"shake_ros\[cluster\]"), engine("tcp://127.0.0.1:1"):
        pass


def test_the_number_of_workers_is_the_clusters_own():
    with pytest.raises(ShakeError, match="set by the cluster"), engine("tcp://127.0.0.1:1", workers=2):
        pass


@needs_dask
def test_a_worker_killed_on_the_cluster_changes_no_row(tmp_path):
    import dask
    from distributed import LocalCluster

    def rows(address, times):
        folder = tmp_path / str(times)
        folder.mkdir()
        given = (Task(str(s), {"seed": s, "bad": 31, "folder": str(folder), "times": times}) for s in range(60))
        with engine(address) as on:
            found = [o for batch in run(on, "benchmarks.campaign.tasks:deadly", given) for o in batch]
        assert len(found) == 60
        return {o.task.key: o.figures for o in found}

    sums = function_of("benchmarks.campaign.tasks:sums")
    wanted = {str(seed): json.dumps(sums(seed), sort_keys=True) for seed in range(60)}
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster,
    ):
        address = cluster.scheduler_address
        assert rows(address, 0) == wanted
        assert rows(address, 1) == wanted
        assert rows(address, 99) == {**wanted, "31": None}


@needs_dask
@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed: no certificate can be made")
def test_an_encrypted_cluster_is_reached_with_the_certificates_of_dasks_configuration(tmp_path):
    import dask
    from distributed import LocalCluster, Security

    key, cert = tmp_path / "key.pem", tmp_path / "cert.pem"
    made = f"req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=localhost -keyout {key} -out {cert}"
    subprocess.run(["openssl", *made.split()], check=True, capture_output=True)
    tls = {
        f"distributed.comm.tls.{who}.{what}": str(path)
        for who in ("scheduler", "worker", "client")
        for what, path in (("cert", cert), ("key", key))
    }
    with (
        dask.config.set({"distributed.comm.tls.ca-file": str(cert), **tls}),
        LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=None, security=Security(require_encryption=True)
        ) as cluster,
    ):
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        given = (Task(str(seed), {"seed": seed}) for seed in range(3))
        with engine(address) as on:
            found = [o for batch in run(on, "benchmarks.campaign.tasks:nothing", given) for o in batch]
    assert sorted(o.figures for o in found) == ['{"seed": 0}', '{"seed": 1}', '{"seed": 2}']


@needs_dask
def test_where_nobody_answers_a_line_says_so(monkeypatch):
    monkeypatch.setattr("shake_ros.campaigns.engine.WAIT", 0.5)
    with pytest.raises(ShakeError, match="no connection"), engine("tcp://127.0.0.1:9"):
        pass


@needs_dask
def test_without_certificates_an_encrypted_address_says_so(monkeypatch):
    monkeypatch.setattr("shake_ros.campaigns.engine.WAIT", 0.5)
    with pytest.raises(ShakeError, match=r"engine tls://127\.0\.0\.1:9"), engine("tls://127.0.0.1:9"):
        pass
