"""Whether every failure is seen with its severity, and a clean campaign raises none.

    fault <CODE>         part of the campaigns with that fault that get its code at the right severity, and
                         are neither refused nor stripped of anything under another code
    false alarms <CODE>  part of the clean campaigns that get the code
    false alarms in all  part of the clean campaigns that get any

A difference between the two directions' F_c is E-OFFSET by right: a clean rig is asked for it only where both
directions have one law.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from multiprocessing import get_context
from typing import Final

import numpy as np

from benchmarks.calibration.clean_campaigns import Campaign, clean_campaign
from benchmarks.calibration.injected_faults import FAULTS, Stage
from benchmarks.rows import Row, figure
from data.findings import Finding, LogError, Severity
from data.ingest import screened_recording
from data.recording import Recording
from ident.evidence.gathering import gather, require_evidence, run_findings
from ident.evidence.ripple_correction import ripple_findings
from ident.identification import identify

SEEDS: Final = 50
QUICK_SEEDS: Final = 3
CLEAN: Final = 200
QUICK_CLEAN: Final = 6
BEGUN: Final = 1.7e9  # [s] from 1970 to the first log
APART: Final = 60.0  # [s] from log to log, in the order of the campaign
_GRAVE: Final = {Severity.WARN: 0, Severity.WITHHOLD: 1, Severity.REFUSE: 2}
_CODE: Final = re.compile(r"E-[A-Z]+")


def rows(quick: bool) -> list[Row]:
    """The rows of every code."""
    seeds, clean = (QUICK_SEEDS, QUICK_CLEAN) if quick else (SEEDS, CLEAN)
    tasks = [(code, seed) for seed in range(seeds) for code in FAULTS]
    with get_context("spawn").Pool(os.cpu_count()) as pool:
        right = pool.starmap(is_right, tasks, chunksize=4)
        alarms = pool.map(false_alarms, range(clean), chunksize=2)
    seen = Counter(code for (code, _), well in zip(tasks, right, strict=True) if well)
    found = [figure(f"fault {code}", seen[code] / seeds, 0.99, "of campaigns") for code in FAULTS]
    raised = Counter(code for codes in alarms for code in codes)
    found += [figure(f"false alarms {code}", raised[code] / clean, 0.01, "of campaigns") for code in FAULTS]
    share = sum(bool(codes) for codes in alarms) / clean
    return [*found, figure("false alarms in all", share, 0.05, "of campaigns")]


def is_right(code: str, seed: int) -> bool:
    """Whether one injected fault gets its code and severity, and no other code does any harm."""
    injected = FAULTS[code](np.random.default_rng([seed, *code.encode()]))
    said = said_of(injected.campaign, injected.stage)
    allowed = {code, *injected.also}
    harmless = all(_GRAVE[worst] == 0 for other, worst in said.items() if other not in allowed)
    return said.get(code) in injected.severities and harmless


def false_alarms(seed: int) -> tuple[str, ...]:
    """The codes that one clean campaign gets."""
    campaign = clean_campaign(np.random.default_rng([seed, 1]))
    deserved = set() if campaign.rig.is_symmetric else {"E-OFFSET"}
    return tuple(sorted(set(said_of(campaign, "fit")) - deserved))


def said_of(campaign: Campaign, stage: Stage) -> Mapping[str, Severity]:
    """Each code that the product gives a campaign, as far as a stage, with its worst severity."""
    worst: dict[str, Severity] = {}
    for finding in findings_of(campaign, stage):
        if finding.code not in worst or _GRAVE[finding.severity] > _GRAVE[worst[finding.code]]:
            worst[finding.code] = finding.severity
    return worst


def findings_of(campaign: Campaign, stage: Stage) -> list[Finding]:
    """Everything that the product says of a campaign, as far as a stage; a refusal is the last word."""
    found: list[Finding] = []
    try:
        recordings = recorded(campaign)
        found += [finding for recording in recordings for finding in recording.findings]
        if stage == "fit":
            return list(identify(recordings).robot.notes)
        if stage == "evidence":
            evidence = gather(recordings)
            found += [*run_findings(evidence), *ripple_findings(evidence.waves, campaign.rig.axis)]
            if len(recordings) > 1:
                require_evidence(recordings, evidence)
    except LogError as refusal:
        code = _CODE.search(str(refusal))
        found.append(Finding(code.group() if code else "", Severity.REFUSE, str(refusal)))
    return found


def recorded(campaign: Campaign) -> list[Recording]:
    """The logs of a campaign, screened; raises `LogError`."""
    rig = campaign.rig
    counts = (2.0 * math.pi if rig.axis == "rotary" else 1.0) / rig.resolution
    read = (
        screened_recording(
            log,
            clock="column 't'",
            axis=rig.axis,
            encoder_counts=counts if rig.declared else None,
            torque_limit=rig.torque_limit,
        )
        for log in campaign.logs
    )
    return [replace(recording, begun=BEGUN + APART * n) for n, recording in enumerate(read)]
