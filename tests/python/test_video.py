"""Video in and out, plates, and files that are not what they should be."""

import errno
import json
import re
import struct
import wave
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from drawn_person import clip, wall, write

import gait.cli
from gait import Model, UserError, Video, VideoWriter, background
from gait.bindings.model import read_blob
from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera
from gait.io import blob
from gait.io.video import median_plate
from gait.lift.video.run import Request, lift_video, open_clip
from gait.report.film import Films
from gait.track.further_cameras import SeveralVideos
from gait.track.moving_video import MovingVideo

FAULTS = Path(__file__).resolve().parents[2] / "../shared/data/faults"


def pattern(i, width=64, height=48):
    """Smooth picture with a bright bar whose place shows the frame number."""
    image = np.full((height, width, 3), 60, np.uint8)
    image[:, 4 * i : 4 * i + 4] = (200, 180, 220)
    return image


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    path = tmp_path_factory.mktemp("video") / "bars.mp4"
    with VideoWriter(path, 25, crf=2) as writer:
        for i in range(12):
            writer.write(pattern(i))
    return path


def test_what_was_written_is_read_back(film):
    video = Video(film)
    assert (video.size, video.count, video.fps) == ((64, 48), 12, 25)
    frames = list(video.frames())
    assert [f.number for f in frames] == list(range(12))
    assert [f.utime for f in frames] == [40000 * i for i in range(12)]
    np.testing.assert_allclose(video.times, [f.time for f in frames])
    for frame in frames:
        assert frame.image.shape == (48, 64, 3) and frame.image.dtype == np.uint8
        assert np.abs(frame.image.astype(int) - pattern(frame.number)).mean() < 6
        assert frame.image[:, :, 2].mean(axis=0).argmax() // 4 == frame.number


def test_a_part_is_the_same_as_that_part_of_the_whole(film):
    video = Video(film)
    whole, part = list(video.frames()), list(video.frames(3, 7))
    assert [f.number for f in part] == [3, 4, 5, 6]
    for frame in part:
        assert frame.time == whole[frame.number].time
        np.testing.assert_array_equal(frame.image, whole[frame.number].image)


def test_grey(film):
    grey = next(Video(film).frames(grey=True)).image
    assert grey.shape == (48, 64)
    colour = next(Video(film).frames()).image
    assert np.abs(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY).astype(int) - grey).mean() < 4


@pytest.mark.parametrize("shape", [(47, 63, 3), (47, 64), (48, 63)])
def test_uneven_sizes_and_grey_are_accepted(shape, tmp_path):
    with VideoWriter(tmp_path / "uneven.mkv", 30) as writer:
        writer.write(np.full(shape, 100, np.uint8))
    assert Video(tmp_path / "uneven.mkv").size == (64, 48)


def test_an_error_leaves_no_file_and_not_the_old_one_changed(tmp_path):
    path = tmp_path / "out.mp4"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError), VideoWriter(path, 30) as writer:
        writer.write(pattern(0))
        raise RuntimeError
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


def test_an_interrupt_keeps_a_film_of_the_frames_so_far(tmp_path):
    with pytest.raises(KeyboardInterrupt), VideoWriter(tmp_path / "out.mp4", 30) as writer:
        for i in range(7):
            writer.write(pattern(i))
        raise KeyboardInterrupt
    assert Video(tmp_path / "out.unfinished.mp4").count == 7 and len(list(tmp_path.iterdir())) == 1


def test_what_fails_in_the_encoder_is_raised(tmp_path, monkeypatch):
    def fail(self, image):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(VideoWriter, "_encode", fail)
    with (
        pytest.raises(UserError, match="out.mp4: No space left on device; choose another place"),
        VideoWriter(tmp_path / "out.mp4", 30) as writer,
    ):
        for i in range(20):
            writer.write(pattern(i))
    assert not list(tmp_path.iterdir())
    with (
        pytest.raises(UserError, match="run.html: No space left on device in .*set TMPDIR"),
        Films(None, "run.html", range(20), (64, 48), 30.0) as films,
    ):
        films.write(pattern(0), 0)


def test_frames_of_another_size_are_refused(tmp_path):
    with (
        pytest.raises(ValueError, match="32x24 in a video with another size"),
        VideoWriter(tmp_path / "out.mp4", 30) as writer,
    ):
        writer.write(pattern(0))
        writer.write(pattern(0, 32, 24))


@pytest.mark.parametrize("name, words", [("o.avi", "unknown video suffix"), ("no/o.mp4", "does not exist")])
def test_places_that_cannot_be_written(name, words, tmp_path):
    with pytest.raises(UserError, match=words), VideoWriter(tmp_path / name, 30):
        pass


def test_unreadable_video_is_one_clear_line(tmp_path):
    path = tmp_path / "broken.mp4"
    path.write_bytes(b"not a video at all" * 100)
    with pytest.raises(UserError, match="broken.mp4: cannot be read as video .*; give a file") as caught:
        Video(path)
    assert "\n" not in str(caught.value)


def test_cut_off_video_is_reported(film, tmp_path):
    path = tmp_path / "cut.mp4"
    path.write_bytes(film.read_bytes()[:200])
    with pytest.raises(UserError, match="cut.mp4: "):
        list(Video(path).frames())


def break_off(film, whole, cut):
    """Write a film that begins with its index, and the same without the frames from the ninth on."""
    with av.open(str(film)) as source, av.open(str(whole), "w", options={"movflags": "faststart"}) as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            packet.stream = stream
            if packet.dts is not None:
                target.mux(packet)
    with av.open(str(whole)) as container:
        ninth = [packet.pos for packet in container.demux(video=0) if packet.size][8]
    cut.write_bytes(whole.read_bytes()[:ninth])


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_a_film_that_breaks_off_names_the_last_frame(suffix, film, tmp_path):
    whole, cut = tmp_path / f"whole.{suffix}", tmp_path / f"cut.{suffix}"
    break_off(film, whole, cut)
    assert Video(whole).broken is None
    assert f"cut.{suffix}: breaks off after frame 8 of 12" in Video(cut).broken


def spoil(film, path, monkeypatch):
    """Write a film that states frames which it lacks, and of which the decoder calls the third damaged."""
    break_off(film, path.with_suffix(".whole.mp4"), path)
    decode = Video._decode

    def spoilt(self, stop):
        for index, time, frame in decode(self, stop):
            if index == 2:
                self._damaged.add(index)
            yield index, time, frame

    monkeypatch.setattr(Video, "_decode", spoilt)


def test_damage_is_reported_beside_a_missing_end_by_all_kinds_of_films(film, tmp_path, monkeypatch):
    spoil(film, tmp_path / "bad.mp4", monkeypatch)
    camera = Camera.looking((0.0, -4.0, 1.0), (0.0, 0.0, 1.0), (64, 48), 60.0)
    for wrap in (
        lambda video: video,
        lambda video: MovingVideo(video, camera, dict.fromkeys(range(12))),
        lambda video: SeveralVideos(video, [Video(film)], [0.0]),
        lambda video: SeveralVideos(Video(film), [video], [0.0]),
    ):
        video = wrap(Video(tmp_path / "bad.mp4"))
        assert "bad.mp4: breaks off after frame 8 of 12; copy it again" in video.broken
        assert len(list(video.frames())) >= 7
        words = r"bad.mp4: breaks off after frame 8 of 12; frames are damaged: 1, first 2; copy it again"
        assert re.search(words, video.broken)


def test_detect_reports_damage_that_the_detector_met(film, tmp_path, monkeypatch, capsys):
    spoil(film, tmp_path / "bad.mp4", monkeypatch)
    monkeypatch.setattr("gait.detect.people.detect", lambda video, *_, **__: dict(enumerate(video.frames(9))))
    assert gait.cli.main(["detect", str(tmp_path / "bad.mp4"), "-o", str(tmp_path / "k.csv")]) == 1
    assert re.match("warning: .*frames are damaged: 1, first 2; ", capsys.readouterr().err)


def test_lifting_reports_damage_that_the_sensors_met(film, tmp_path, monkeypatch):
    spoil(film, tmp_path / "bad.mp4", monkeypatch)
    (tmp_path / "p.json").write_text(json.dumps(PLACED))
    warned = []
    request = Request(str(tmp_path / "bad.mp4"), str(tmp_path / "p.json"), background="none", start=0)
    open_clip(request, SegmentPrior.load(), warned.append, quiet=True)
    assert len(warned) == 1 and "frames are damaged: 1, first 2; " in warned[0]


def test_missing_video(tmp_path):
    with pytest.raises(UserError, match="none.mp4: no such video file"):
        Video(tmp_path / "none.mp4")


def test_sound_alone_is_no_video(tmp_path):
    path = tmp_path / "tone.wav"
    with wave.open(str(path), "wb") as sound:
        sound.setparams((1, 2, 8000, 0, "NONE", ""))
        sound.writeframes(bytes(1600))
    with pytest.raises(UserError, match="tone.wav: has no video stream"):
        Video(path)


def test_median_plate_removes_a_person(tmp_path):
    # the walk crosses the picture, so that every pixel is free most of the time
    pictures, _ = clip(Model(), blob.decode(read_blob(None)), 60, start=(-1.6, 0.0))
    write(tmp_path / "walk.mp4", pictures)
    shown = []
    plate = median_plate(Video(tmp_path / "walk.mp4"), samples=21, progress=shown.append)
    assert shown == list(range(60))
    off, with_person = (
        np.abs(picture.mean(axis=2) - wall().mean(axis=2)) for picture in (plate, pictures[30])
    )
    assert np.percentile(off, 99) < 10
    assert np.percentile(with_person, 99) > 40  # so the person would have been seen


def test_background_option(film, tmp_path):
    video = Video(film)
    assert background("none", video) is None
    plate = background("auto", video)
    assert plate.shape == (48, 64, 3) and abs(int(np.median(plate)) - 60) < 6
    cv2.imwrite(str(tmp_path / "plate.png"), pattern(0))
    np.testing.assert_array_equal(background(str(tmp_path / "plate.png"), video), pattern(0))


def test_plates_that_do_not_fit(film, tmp_path):
    video = Video(film)
    cv2.imwrite(str(tmp_path / "small.png"), pattern(0, 32, 24))
    (tmp_path / "text.png").write_text("no picture")
    for name, words in [
        ("small.png", "small.png: is 32x24, the video 64x48"),
        ("text.png", "text.png: cannot be read as an image"),
        ("none.png", "none.png: no such background image"),
    ]:
        with pytest.raises(UserError, match=words):
            background(str(tmp_path / name), video)


def patched(film, path, box, at, values):
    """Copy an MP4 with 32-bit numbers of a box overwritten; `at` counts from the end of the box's name."""
    content = bytearray(film.read_bytes())
    struct.pack_into(f">{len(values)}i", content, content.index(box) + len(box) + at, *values)
    path.write_bytes(content)
    return Video(path)


def turned(film, path, a, b, c, d):
    """Copy an MP4 with another display matrix: x to (a, b), y to (c, d)."""
    one = 1 << 16
    matrix = [a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30]
    return patched(film, path, b"tkhd", 40, [round(value) for value in matrix])


@pytest.mark.parametrize(
    "matrix, shown",
    [
        ((1, 0, 0, 1), lambda image: image),
        ((-1, 0, 0, -1), lambda image: image[::-1, ::-1]),
        ((0, 1, -1, 0), lambda image: np.rot90(image, -1)),
        ((0, -1, 1, 0), lambda image: np.rot90(image)),
        ((-1, 0, 0, 1), lambda image: image[:, ::-1]),
        ((1, 0, 0, -1), lambda image: image[::-1]),
        ((0, 1, 1, 0), lambda image: image.swapaxes(0, 1)),
        ((0, -1, -1, 0), lambda image: image[::-1, ::-1].swapaxes(0, 1)),
    ],
)
def test_pictures_are_turned_and_mirrored_as_the_container_asks(matrix, shown, film, tmp_path):
    plain = next(Video(film).frames(5)).image
    video = turned(film, tmp_path / "turned.mp4", *matrix)
    np.testing.assert_array_equal(next(video.frames(5)).image, shown(plain))
    assert video.size == shown(plain).shape[1::-1]
    with av.open(str(tmp_path / "turned.mp4")) as container:  # the test's idea of a turn is FFmpeg's
        rotation = next(container.decode(video=0)).rotation
    if np.linalg.det(np.reshape(matrix, (2, 2))) > 0:
        np.testing.assert_array_equal(np.rot90(plain, rotation // 90), shown(plain))


@pytest.mark.parametrize(
    "matrix", [(0.7, 0.7, -0.7, 0.7), (2, 0, 0, 1), (1, 0.5, 0, 1), (0, 0, 0, 0), (1, 0, 1, 0), (1, 1, 0, 0)]
)
def test_display_matrices_that_are_no_turn_are_refused(matrix, film, tmp_path):
    with pytest.raises(UserError, match="turned.mp4: its display matrix .* convert it with ffmpeg"):
        turned(film, tmp_path / "turned.mp4", *matrix)


@pytest.fixture(scope="module")
def trimmed(film, tmp_path_factory):
    """A film whose edit list cuts off its first five frames; the header counts them."""
    path = tmp_path_factory.mktemp("trimmed") / "trimmed.mp4"
    with av.open(str(film)) as container:
        stream = container.streams.video[0]
        times = sorted(packet.pts for packet in container.demux(stream) if packet.pts is not None)
    shift = struct.unpack_from(">i", film.read_bytes(), film.read_bytes().index(b"elst") + 16)[0]
    return patched(film, path, b"elst", 12, [shift + times[5]])


def test_frames_that_an_edit_list_cuts_off_are_not_counted(trimmed):
    with av.open(str(trimmed.path)) as container:
        assert container.streams.video[0].frames == 12
    shown = list(trimmed.frames())
    assert trimmed.count == len(shown) == 7
    np.testing.assert_allclose(trimmed.times, [frame.time for frame in shown])


PLACED = {"frame": 3, "pelvis_px": [30, 24], "height_px": 30, "heading_rad": 0, "stature_m": 1.7}


@pytest.mark.parametrize("given", [0, 3])
def test_lifting_names_the_frame_from_which_none_can_be_decoded(given, film, tmp_path, monkeypatch):
    """A header may promise frames that damage hides: the first three are decoded, or none."""
    placement = tmp_path / "placement.json"
    placement.write_text(json.dumps(PLACED))
    whole = Video.frames
    monkeypatch.setattr(Video, "frames", lambda self, first, stop: whole(self, first, min(stop, given)))
    request = Request(str(film), str(placement), background="none", start=0)
    prior = SegmentPrior.load()
    with pytest.raises(UserError, match=f"bars.mp4: no frame from {given} on can be decoded"):
        lift_video(request, prior, print, quiet=True)


@pytest.mark.skipif(not FAULTS.is_dir(), reason="../shared/data/faults is absent")
def test_public_files():
    cut = Video(FAULTS / "editlist" / "cut.mp4")
    assert cut.count == len(list(cut.frames())) == 30
    mirrored, plain = (
        next(Video(FAULTS / "mirror_matrix" / name).frames()).image.astype(int)
        for name in ("mirrored.mp4", "same_picture_plain.mp4")
    )
    assert np.abs(mirrored - plain).mean() < 3 < np.abs(mirrored[::-1, ::-1] - plain).mean()
