"""Pictures of the study of fault detection."""

from __future__ import annotations
