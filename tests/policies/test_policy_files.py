"""Policy files that are damaged, from elsewhere, hostile, or of another agent or seed."""

import io
import json
import pickle
import re
import time
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from commands import COMMAND_SIGNS
from small_policies import COMMANDS, NUMBERS, linear_policy

from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import digest, write_bytes, write_json
from jumping_ant.base.paths import Paths
from jumping_ant.policies import policy_file, tensors, trained_policy

HEADER = {"num_observations": 27, "num_motors": 8, "format": 3, "seed": 0}
HEADER |= {"hold": 1, "amplitude": 1.0}


def archive(
    kind: Any = "uniform", table: Any = None, network: bytes | None = None, **header: Any
) -> bytes:
    entries = {"policy.json": json.dumps(HEADER | {"kind": kind} | header).encode()}
    entries |= {} if table is None else {"commands.npy": npy(table)}
    return pack(entries | ({} if network is None else {"policy.pth": network}))


def npy(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def saved(content: Any) -> bytes:
    buffer = io.BytesIO()
    torch.save(content, buffer)
    return buffer.getvalue()


def state_dict(**state: Any) -> bytes:
    return saved({name: torch.from_numpy(value) for name, value in state.items()})


def layers(prefix: str, *weights: Any) -> bytes:
    """The tensors of a network of these layers: `actor.mu` is TD3's, `q_net.q_net` DQN's."""
    state = {f"{prefix.partition('.')[0]}.features_extractor.factors": np.ones(27)}
    for number, weight in enumerate(weights):
        name = f"{prefix}.{number}"
        state |= {f"{name}.weight": weight, f"{name}.bias": np.ones(len(weight))}
    return state_dict(**state)


def bomb(*shape: int) -> bytes:
    """A network whose weights are one number, again and again: a few kB that say terabytes."""
    number = torch.ones(1)
    state = {
        "actor.features_extractor.factors": number.expand(shape[1]),
        "actor.mu.weight": number.expand(shape),
        "actor.mu.bias": number.expand(shape[0]),
    }
    return saved(state)


def compressed(content: bytes) -> bytes:
    """The same archive, compressed."""
    entries, buffer = Archive(content), io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name in entries:
            packed.writestr(name, entries[name])
    return buffer.getvalue()


def says(shape: tuple[int, ...]) -> bytes:
    """An .npy file whose header says more than it holds."""
    small = npy(np.zeros((8, 27), np.float32))
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}"
    return small[:10] + header.encode().ljust(117) + b"\n" + small[128:]


NETWORK_OF_FIVE = layers("q_net.q_net", np.ones((5, 27)))
OPEN_LOOP = dict(Archive(NUMBERS["open loop"].to_bytes()))
OSCILLATORS = dict(Archive(NUMBERS["oscillator"].to_bytes()))
LINEAR = linear_policy().to_bytes()
ARRAYS = dict(Archive(LINEAR))
LEVELLED = OPEN_LOOP["policy.json"].replace(b"}", b', "levels": 2}')
DAMAGED = {
    "empty": b"",
    "text": b"no policy at all",
    "truncated": LINEAR[:-30],
    "flipped bit": LINEAR[:400] + bytes([LINEAR[400] ^ 1]) + LINEAR[401:],
    "foreign zip": pack({"a.txt": b"a"}),
    "no header": pack({name: ARRAYS[name] for name in ARRAYS if name != "policy.json"}),
    "header of other kind": archive("ppo"),
    "header of odd kind": archive(["linear"]),
    "header not JSON": pack({"policy.json": b"{"}),
    "header a list": pack({"policy.json": b"[]"}),
    "array missing": pack({name: ARRAYS[name] for name in ARRAYS if name != "bias.npy"}),
    "array of other shape": pack(ARRAYS | {"weight.npy": npy(np.zeros((8, 26)))}),
    "too few torques": pack(
        ARRAYS | {"weight.npy": npy(np.zeros((7, 27))), "bias.npy": npy(np.zeros(7))}
    ),
    "no network": archive("sac", network=state_dict()),
    "other network": archive("td3", network=layers("actor.mu", np.ones((8, 26)))),
    "flat network": archive("td3", network=layers("actor.mu", np.ones(27))),
    "too many commands": archive(
        "dqn", COMMAND_SIGNS, network=layers("q_net.q_net", np.ones((9, 27)))
    ),
    "commands without a table": archive("dqn", network=NETWORK_OF_FIVE),
    "torn tensors": archive("dqn", COMMAND_SIGNS, network=NETWORK_OF_FIVE[:-50]),
    "open loop without a table": archive("open_loop"),
    "table without rows": archive("open_loop", COMMAND_SIGNS[:0]),
    "table of other width": archive("open_loop", COMMAND_SIGNS[:, :7]),
    "flat table": archive("open_loop", COMMAND_SIGNS[0]),
    "table of text": archive("open_loop", np.full((2, 8), "up")),
    "table of infinities": archive("open_loop", np.full((2, 8), np.inf)),
    "table beyond the peak torque": archive("open_loop", np.full((2, 8), 1.5)),
    "torn table": pack(OPEN_LOOP | {"commands.npy": OPEN_LOOP["commands.npy"][:-5]}),
    "oscillators of other number": pack(
        OSCILLATORS | {f"{name}.npy": npy(np.ones(7)) for name in ("amplitudes", "offsets")}
    ),
    "oscillator without a phase": pack(OSCILLATORS | {"phases.npy": npy(np.ones(7))}),
    "three speeds": pack(OSCILLATORS | {"speeds.npy": npy(np.ones(3))}),
    "speed not a number": pack(OSCILLATORS | {"speeds.npy": npy(np.array([1, np.nan]))}),
    "held for no time": archive(hold=0),
    "held backwards": archive(hold=-3),
    "held for a word": archive(hold="long"),
    "held for half a step": archive(hold=0.5),
    "amplitude missing": pack({"policy.json": b'{"kind": "uniform", "seed": 0, "hold": 1}'}),
    "amplitude no number": archive(amplitude="loud"),
    "amplitude not finite": archive(amplitude=float("nan")),
    "amplitude beyond the peak torque": archive(amplitude=2.0),
    "one level": archive(levels=1),
    "levels without end": archive(levels=10**9),
    "levels and a table": pack(OPEN_LOOP | {"policy.json": LEVELLED}),
    "later format": pack({"policy.json": ARRAYS["policy.json"].replace(b": 3,", b": 4,")}),
    "weight not a number": pack(ARRAYS | {"weight.npy": npy(np.full((8, 27), np.nan))}),
    "bias infinite": pack(ARRAYS | {"bias.npy": npy(np.full(8, np.inf))}),
    "stdev zero": pack(ARRAYS | {"stdev.npy": npy(np.zeros(27))}),
    "mean for all": pack(ARRAYS | {"mean.npy": npy(np.zeros(()))}),
    "weight of terabytes": pack(ARRAYS | {"weight.npy": says((1_000_000, 1_000_000))}),
    "compressed": compressed(LINEAR),
    "compressed tensors": archive("sac", network=compressed(bomb(8, 27))),
    "one number for all": archive("sac", network=bomb(8, 27)),
    "one number for terabytes": archive("sac", network=bomb(1_000_000, 1_000_000)),
    "network not a number": archive("td3", network=layers("actor.mu", np.full((8, 27), np.nan))),
    "layers of other widths": archive(
        "td3", network=layers("actor.mu", np.ones((9, 27)), np.ones((8, 10)))
    ),
    "motors beyond number": archive(num_motors=10**9),
    "observations beyond number": archive(num_observations=10**12),
}


@pytest.mark.parametrize("content", DAMAGED.values(), ids=DAMAGED.keys())
def test_damaged_and_foreign_files_are_refused(content: bytes) -> None:
    with pytest.raises(InputError, match="policy file: .*allowed: ") as caught:
        policy_file.parse(content)
    assert "\n" not in str(caught.value)


def test_what_does_not_belong_to_a_policy_is_not_read(tmp_path: Path) -> None:
    path, size = tmp_path / "policy.zip", 2**26
    path.write_bytes(pack(ARRAYS | {"stray": bytes(size)}))
    tracemalloc.start()
    policy_file.load(path)
    policy_file.read_interface(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < size / 8


def test_the_damage_is_all_that_is_wrong() -> None:
    """What the damaged files above are made of is accepted."""
    for content in (
        archive(hold=3),
        archive("open_loop", COMMAND_SIGNS),
        archive("dqn", COMMAND_SIGNS, network=NETWORK_OF_FIVE),
        archive(amplitude=0.5, levels=2),
        pack(OPEN_LOOP),
        pack(OSCILLATORS),
        pack(ARRAYS),
        archive("td3", network=layers("actor.mu", np.ones((8, 27)))),
        archive("td3", network=layers("actor.mu", np.ones((9, 27)), np.ones((8, 9)))),
    ):
        assert policy_file.parse(content).actions.hold >= 1


class Payload:
    """Pickled, this makes a file when it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


@pytest.mark.filterwarnings("ignore:Detected pickle protocol")
def test_pickled_code_is_not_run(tmp_path: Path) -> None:
    planted = tmp_path / "planted"
    payload = Payload(planted)
    files = [
        archive("sac", network=pickle.dumps(payload)),
        archive("dqn", network=saved(payload)),
        pack(ARRAYS | {"weight.npy": npy(np.array([payload], dtype=object))}),
        pack(ARRAYS | {"mean.npy": pickle.dumps(payload)}),
        pickle.dumps(payload),
    ]
    for content in files:
        with pytest.raises(InputError, match="policy file: "):
            policy_file.parse(content)
        assert not planted.exists()
    pickle.loads(files[-1])
    assert planted.exists()  # the payload would have worked


def test_tensors_are_read_as_pytorch_reads_them() -> None:
    whole = torch.arange(24.0)
    state = {
        "a part": whole[3:9].reshape(1, 2, 3),
        "all": whole.reshape(4, 6),
        "doubles": torch.ones(2, 1, dtype=torch.float64),
        "a count": torch.tensor(5),
    }
    read = tensors.read(saved(state))
    assert list(read) == list(state)
    for name, expected in state.items():
        assert read[name].dtype == expected.numpy().dtype
        np.testing.assert_array_equal(read[name], expected.numpy(), strict=True)
    for refused in ({"turned": whole.reshape(4, 6).T}, {"halves": whole.half()}):
        with pytest.raises((ValueError, pickle.UnpicklingError)):
            tensors.read(saved(refused))


def spoilt(index: bytes, size: int = 100) -> bytes:
    """Return a file of a tensor with another pickle; `size` numbers are in its storage."""
    entries = dict(Archive(saved({"a": torch.zeros(size)})))
    (name,) = (name for name in entries if name.endswith("/data.pkl"))
    return pack({**entries, name: index})


def text(content: str) -> bytes:
    return b"X" + len(content).to_bytes(4, "little") + content.encode()


def tensor(shape: bytes) -> bytes:
    """Return an entry of a dictionary: a tensor of a hundred numbers, as pickle writes it."""
    storage = text("storage") + b"ctorch\nFloatStorage\n" + text("0") + text("cpu") + b"K\x64"
    return b"ctorch._utils\n_rebuild_tensor_v2\n((" + storage + b"tQK\x00" + shape + b"}tR"


HUNDRED = tensor(b"K\x64\x85K\x01\x85")
TUPLES = b"".join(b"h%ch%c\x86q%c" % (row, row, row + 1) for row in range(60))
SPOILT = [
    (b"})q\x00" + TUPLES + b"K\x01s.", "a part that repeats"),  # it would double in each
    (b"}" + b")" + b"\x85" * 10**5 + b"K\x01s.", "a name that is no text"),  # to hash in depth
    (b"}q\x00" + text("a") + b"h\x00s.", "a part that repeats"),
    (b"}" + text("a") + b")2s.", "DUP None in a file"),
    (b"X\xff\xff\xff\x7fa.", "expected 2147483647 bytes"),
    (
        b"}(" + b"".join(text(f"{number}") + HUNDRED for number in range(300)) + b"u.",
        "tensors that are larger than their file",
    ),
    (b"}" + text("a") + tensor(b"J\xff\xff\xff\xff\x85)") + b"s.", "zip|shorter|shape"),
    (b"}" + text("a") + tensor(b"J\xff\xff\xff\xff\x85K\x01\x85") + b"s.", r"shape \(-1,\)"),
    (b"}" + b"0" * 2**18 + b".", "an index of more than"),
    (b"}", "exhausted|without an end"),
]


@pytest.mark.parametrize(("index", "fault"), SPOILT)
def test_a_files_size_bounds_the_time_and_memory_of_reading_it(index: bytes, fault: str) -> None:
    content = spoilt(b"\x80\x02" + index)
    began = time.process_time()
    tracemalloc.start()
    with pytest.raises(ValueError, match=fault):
        tensors.read(content)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert time.process_time() - began < 10 and peak < 60 * len(content) + 10**6


def test_tensors_written_by_hand_are_read() -> None:
    read = tensors.read(spoilt(b"\x80\x02}(" + text("a") + HUNDRED + b"u."))
    np.testing.assert_array_equal(read["a"], np.zeros(100))


def test_a_missing_file_names_what_writes_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"policy.zip: No such file .*; `dvc repro` trains it"):
        policy_file.load(tmp_path / "policy.zip")


@pytest.mark.parametrize("is_final", [False, True])
def test_a_policy_is_the_one_that_was_trained(tmp_path: Path, is_final: bool) -> None:
    """Another one of the same agent and seed, as from a remote that somebody else writes to."""
    paths = Paths(tmp_path).agent("sac").seed(20)
    path = paths.final_policy if is_final else paths.policy
    with pytest.raises(InputError, match="No such file or directory; run `dvc repro train@sac`"):
        paths.content(path)
    write_bytes(path, policy_file.owned(LINEAR, paths.owner))
    write_json(paths.trained, {"20": {path.name: digest(path)}})
    assert trained_policy.load(paths, is_final).to_bytes() == LINEAR
    other = linear_policy(COMMANDS).to_bytes()
    write_bytes(path, policy_file.owned(other, paths.owner))
    told = f"{path}: given another file than was trained, of SHA-256 {digest(path)[:8]}..., allowed"
    with pytest.raises(InputError, match=re.escape(told)):
        trained_policy.load(paths, is_final)
    known = {path.name: digest(path)}
    for digests in ({"21": known}, {"20": {"curve.csv": ""}}, {"20": [1]}, {"20": "x"}):
        write_json(paths.trained, digests)
        with pytest.raises(InputError, match="allowed: None..., as in .*training.json; `dvc ch"):
            trained_policy.load(paths, is_final)


def test_a_damaged_file_is_not_quoted_at_length(tmp_path: Path) -> None:
    """As zipfile does whose entry has a name of thousands of bytes."""
    content = bytearray(pack({**Archive(LINEAR), "more": b"\0" * 5000}))
    content[26:28] = (5000).to_bytes(2, "little")  # the length of the first entry's name
    path = tmp_path / "policy.zip"
    path.write_bytes(content)
    for read in (policy_file.load, policy_file.read_interface):
        with pytest.raises(InputError, match="BadZipFile: File name in directory") as caught:
            read(path)
        assert len(str(caught.value)) < 1000
