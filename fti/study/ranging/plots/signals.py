"""Pictures of the signals: receivers stage by stage, baseband, Doppler (source 003, fig. 2.13, 2.36 to 2.38)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.plot_style import BLACK, BLUE, GREY, GROUND, ORANGE, VERMILION, label_axes, new_figure
from fti.ranging.radar.doppler import range_error
from fti.ranging.radar.receivers import line_spectrum
from fti.ranging.radar.waveform import Waveform, loat_plan, ssb_plan
from fti.study.ranging.signals import EXAMPLES, F_TX, LOAT, SSB, Example, Rays

#: A final approach over ground that rises and falls (2.1.3.4): speed [m/s], path, start [m], wave of the ground [m].
APPROACH_SPEED, APPROACH_PATH, APPROACH_START = 70.0, np.radians(3.0), 8000.0
GROUND_RISE, GROUND_WAVE = 50.0, 1500.0

#: Samples at radio frequency of a plot: 14 us, so that beats are 0.14 MHz wide.
SAMPLES = 1 << 18
GHZ, MHZ = 1e9, 1e6
FLOOR_DB = -70.0
#: Plotted points per sample, and samples outside the plot, where the interpolation is inaccurate.
FINER, MARGIN = 6, 64


@dataclass(frozen=True)
class ReceiverStage:
    """One row: name, plotted time [s], unit and end of the spectrum [Hz], and the expected lines."""

    name: str
    title: str
    seconds: float
    unit: float
    end: float
    lines: dict[str, float]


def loat() -> Figure:
    """Fig. 2.36."""
    plan = loat_plan(F_TX, LOAT.beat)
    low = {"f_if - f_b": plan.rx_if[1]}
    beat = {"f_b": LOAT.beat}
    stages = [
        ReceiverStage("rx", "1  received", 2e-9, GHZ, 9e9, {"f_rx": F_TX - LOAT.beat}),
        ReceiverStage(
            "rx_if", "2  mixed with the local oscillator", 20e-9, GHZ, 9e9, low | {"f_rx + f_lo": plan.rx_if[0]}
        ),
        ReceiverStage("rx_lp", "3  low-pass", 20e-9, MHZ, 500e6, low),
        ReceiverStage(
            "trx", "4  mixed with the transmitted signal", 20e-9, MHZ, 500e6, beat | {"2 f_if - f_b": plan.trx[0]}
        ),
        ReceiverStage("beat", "5  low-pass: the beat signal", 2e-6, MHZ, 10e6, beat),
    ]
    title = "LOAT receiver, stage by stage"
    return _stages(LOAT, stages, title, "4.3 GHz + 300 MHz in 100 us, f_if = 200 MHz")


def ssb() -> Figure:
    """Fig. 2.37."""
    plan = ssb_plan(F_TX, SSB.beat)
    names = ("f1 + f_lo", "f1 - f_lo", "f2 + f_lo", "f_b")
    stages = [
        ReceiverStage("rx", "1  received", 2e-9, GHZ, 9e9, {"f_rx": F_TX - SSB.beat}),
        ReceiverStage(
            "trx", "2  mixed with the lower sideband", 20e-9, GHZ, 9e9,
            {"f1 = f_rx + f_tx - f_lo": plan.trx[0], "f2 = f_lo - f_b": plan.trx[1]},
        ),
        ReceiverStage(
            "trx_lo", "3  mixed with the local oscillator", 20e-9, GHZ, 9e9,
            dict(zip(names, plan.trx_lo, strict=True)),
        ),
        ReceiverStage("beat", "4  low-pass: the beat signal", 2e-6, MHZ, 10e6, {"f_b": SSB.beat}),
    ]  # fmt: skip
    title = "SSB receiver, stage by stage"
    return _stages(SSB, stages, title, "4.3 GHz + 300 MHz in 100 us, f_lo = 500 MHz")


def _stages(example: Example, stages: list[ReceiverStage], title: str, subtitle: str) -> Figure:
    """Time on the left, spectrum on the right, one row a stage."""
    receiver, wave = example.receiver, example.receiver.base.waveform
    rays = Rays.over_level_ground(example.height, 0)
    first = round((F_TX - wave.f_c) / wave.slope * receiver.rate) - SAMPLES // 2
    signals = receiver.stages(rays.ranges, rays.powers, rays.phases, first, SAMPLES)
    scene = f"{len(rays.ranges)} rays of the wide antenna, {rays.height:.1f} m over level ground"
    below = f"{subtitle}; {scene}. Dashed: frequency plan."
    figure = new_figure(title, below, width=10.5, height=2.0 * len(stages) + 0.8)
    rows = figure.subplots(len(stages), 2, squeeze=False, width_ratios=(1.0, 1.25))
    scale = float(np.max(np.abs(signals["rx"])))
    for (time_axes, line_axes), stage in zip(rows, stages, strict=True):
        _draw_time(time_axes, signals[stage.name] / scale, receiver.rate, stage)
        _draw_lines(line_axes, signals[stage.name] / scale, receiver.rate, stage)
    return figure


def _draw_time(axes: Axes, signal: Array, rate: float, stage: ReceiverStage) -> None:
    unit, name = (1e-9, "ns") if stage.seconds < 1e-6 else (1e-6, "us")
    half, middle = round(0.5 * stage.seconds * rate), len(signal) // 2
    fine = _interpolated(signal[middle - half - MARGIN : middle + half + MARGIN])[FINER * MARGIN : -FINER * MARGIN]
    axes.plot(np.arange(len(fine)) / (FINER * rate * unit), fine, color=BLUE, lw=1.0)
    label_axes(axes, f"time [{name}]", "amplitude\n[of peak]", stage.title)
    axes.set_xlim(0.0, stage.seconds / unit)


def _interpolated(signal: Array) -> Array:
    """Interpolate a tone by its spectrum to ``FINER`` times as many samples."""
    lines = np.fft.rfft(signal)
    return np.asarray(np.fft.irfft(lines, FINER * len(signal)) * FINER)


def _draw_lines(axes: Axes, signal: Array, rate: float, stage: ReceiverStage) -> None:
    frequency, lines = line_spectrum(signal, rate)
    shown = frequency <= stage.end
    level = 20.0 * np.log10(np.maximum(lines[shown], 1e-12) / np.max(lines[shown]))
    axes.plot(frequency[shown] / stage.unit, level, color=BLUE, lw=0.9)
    for text, at in stage.lines.items():
        axes.axvline(at / stage.unit, color=VERMILION, lw=0.9, ls="--", zorder=0)
        axes.annotate(
            f"{text}\n{_frequency_text(at)}", (at / stage.unit, 4.0), annotation_clip=False, fontsize=7.5,
            color=VERMILION, ha="center", va="bottom",
        )  # fmt: skip
    axes.set(xlim=(0.0, stage.end / stage.unit), ylim=(FLOOR_DB, 4.0))
    label_axes(axes, f"frequency [{'GHz' if stage.unit == GHZ else 'MHz'}]", "level [dB]")


def _frequency_text(frequency: float) -> str:
    return f"{frequency / GHZ:.4f} GHz" if frequency >= GHZ else f"{frequency / MHZ:.1f} MHz"


def baseband() -> Figure:
    """Fig. 2.38: the spectrum of the beat from the radio-frequency chains, and from the baseband without a carrier."""
    figure = new_figure(
        "Baseband and radio frequency: the same beat, four hundred times fewer samples",
        "One ramp, rays with their phases (speckle), wide antenna over level ground. Below: their difference.",
        width=10.0,
        height=6.0,
    )
    axes = figure.subplots(2, 2, sharex="col", sharey="row", height_ratios=(2.2, 1.0))
    for column, example in zip(axes.T, EXAMPLES, strict=True):
        _draw_pair(column, example)
    return figure


def _draw_pair(column: Array, example: Example) -> None:
    above, below = column
    base, rays = example.receiver.base, Rays.over_level_ground(example.height, 0)
    columns = rays.ranges, rays.powers, rays.phases
    with_carrier, without = example.receiver.coherent(*columns), base.coherent(*columns)
    mhz, beat, top = np.arange(base.n_bin) / base.waveform.delta_t / MHZ, example.beat / MHZ, float(np.max(without))
    above.plot(
        mhz, 10.0 * np.log10(with_carrier / top), color=ORANGE, lw=2.6, label=f"{example.name}, with the carrier"
    )
    above.plot(mhz, 10.0 * np.log10(without / top), color=BLUE, lw=1.0, label="baseband")
    above.axvline(beat, color=GREY, ls="--", lw=0.9, zorder=0, label=f"height: {beat:.1f} MHz")
    above.legend(loc="upper right")
    above.set(xlim=(0.6 * beat, 3.0 * beat), ylim=(-60.0, 5.0))
    label_axes(above, y="power [dB]", title=f"{example.name}, {rays.height:.1f} m")
    below.plot(mhz, 1e6 * (np.sqrt(with_carrier) - np.sqrt(without)) / np.sqrt(top), color=BLACK, lw=0.8)
    label_axes(below, "beat frequency [MHz]", "difference of\namplitudes\n[1e-6 of peak]")


def doppler() -> Figure:
    """Fig. 2.13: the height error of the Doppler shift on an approach."""
    t = np.linspace(0.0, APPROACH_START / APPROACH_SPEED, 1200)
    to_go = APPROACH_START - APPROACH_SPEED * t
    ground = GROUND_RISE * np.cos(2.0 * np.pi * to_go / GROUND_WAVE)
    height = 120.0 + to_go * np.tan(APPROACH_PATH)
    rate = np.gradient(height - ground, t)
    figure = new_figure(
        "Doppler shift: a few centimetres",
        "3 deg approach at 70 m/s over ground that rises and falls by 100 m; 4.3 GHz, 300 MHz in 100 us.",
        width=9.0,
        height=6.2,
    )
    profile, speed, error = figure.subplots(3, 1, sharex=True)
    profile.fill_between(t, -80.0, ground, color=GROUND, lw=0.0, label="ground")
    profile.plot(t, height, color=BLACK, label="aircraft")
    profile.legend()
    label_axes(profile, y="height [m]")
    speed.plot(t, rate, color=BLUE)
    label_axes(speed, y="rate of the height\nabove ground [m/s]")
    error.plot(t, 100.0 * range_error(rate, Waveform()), color=VERMILION)
    label_axes(error, "time [s]", "height error [cm]")
    figure.align_ylabels()
    return figure
