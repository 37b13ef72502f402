# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface that lifecycle.py requires of each kind of follower. The kinds are the modules handle_follower, of
meshes that follow their handles, and source_follower, of meshes that follow a source by a transfer."""

from typing import Any, Protocol


class Frame(Protocol):
    """The input of one update of an object: its handles' motions or its source's pose. They are read when the frame is
    constructed, from a Subject, a deformer or transfer, and the frame_results.FrameResult of the last one, or None."""
    key: Any
    """Equal keys mean equal results."""
    is_hurried: bool
    """After offsets(): whether it left out refinement because share was less than 1."""
    is_draft: bool
    """Whether it was computed by the draft of a deformer that is still being bound."""

    def offsets(self, share):
        """(3 n,) float32: the displacements of all vertices. share: the time that a drag leaves, as a fraction of a
        full update's; less than 1 may give a quicker, rougher result."""

    def written(self, record, wait):
        """Called after the offsets were written to the mesh. record: their frame_results.FrameResult, which this
        completes. wait: whether a slow result must be finished before this returns, as in a render."""


class Kind(Protocol):
    """One kind of follower."""
    cache: Any
    """The job_cache.Cache of its deformers or transfers, by content."""
    Frame: type
    """See above."""

    def has(self, ob):
        """Whether the object is a follower of this kind."""

    def settings(self, ob):
        """The property group whose `problem`, a sentence, its panel shows."""

    def content_of(self, ob):
        """The signature of the content that its deformer or transfer was made for: the key in cache."""

    def others(self, ob):
        """Other objects whose meshes are part of that content."""

    def is_live(self, ob):
        """Whether it is updated automatically, without Update being pressed."""

    def is_outdated(self, subject):
        """Whether compare() is needed before the next frame."""

    def compare(self, ob):
        """Compares the present content with the one that was bound. A sentence if the binding is lost, else ''."""

    def is_fit(self, subject):
        """Whether it can be updated at present."""

    def is_for(self, ob, entry):
        """Whether an entry of the cache fits the object for certain, without comparing content."""

    def job(self, ob):
        """Starts to make the deformer or transfer in the background, and returns the job. Raises MeshProblem or
        native.NativeError."""

    def refuse(self, ob, sentence):
        """Stores why its deformer or transfer could not be made."""

    def forget(self, ob):
        """Removes all data of this kind from the object."""

    def check_frame(self, subject):
        """Raises MeshProblem for faults that would make a frame wrong, such as missing vertex groups."""
