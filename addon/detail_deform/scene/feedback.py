# SPDX-License-Identifier: GPL-3.0-or-later
"""Detects feedback loops: an empty whose place depends on the surface that it moves is moved on by each update, and so
is a curve that takes its shape from it."""

_VERTEX_PARENTS = {'VERTEX', 'VERTEX_3'}


class FeedbackSearch:
    """A search from empties through parents, constraints and modifiers to the vertices of the mesh. Each object is
    visited once, however many empties depend on it."""

    def __init__(self, ob):
        self._ob, self._seen = ob, set()

    def _is_new(self, other, what):
        key = (other.as_pointer(), what)
        if key in self._seen:
            return False
        self._seen.add(key)
        return True

    def through_transform(self, other):
        """A phrase that names the dependency of an object's place on the vertices of the mesh; '' if there is none, or
        the object was visited before. The mesh's own place is no dependency, as handles are relative to it."""
        if other == self._ob or not self._is_new(other, 'place'):
            return ""
        bones = other.pose.bones if other.pose else ()
        return (self._through_parent(other) or self._through_constraints(other, other.constraints)
                or next(filter(None, (self._through_constraints(other, bone.constraints) for bone in bones)), ""))

    def through_shape(self, curve):
        """The same for the shape of a curve, by its modifiers."""
        return next((f"modifier '{modifier.name}' of '{curve.name}'" for modifier in curve.modifiers
                     if self._uses_mesh(modifier)), "")

    def _through_parent(self, other):
        if other.parent is None:
            return ""
        if other.parent_type in _VERTEX_PARENTS:
            return self._through_vertices(other.parent, f"'{other.name}' is parented to vertices")
        return self.through_transform(other.parent)

    def _through_constraints(self, owner, constraints):
        for constraint in constraints:
            target = getattr(constraint, 'target', None)
            if target is None or constraint.mute or not constraint.influence:
                continue
            by_shape = constraint.type == 'SHRINKWRAP' or (
                target.type == 'MESH' and getattr(constraint, 'subtarget', ""))
            phrase = f"constraint '{constraint.name}' of '{owner.name}'"
            found = self._through_vertices(target, phrase) if by_shape else self.through_transform(target)
            if found:
                return found
        return ""

    def _through_vertices(self, other, phrase):
        """said, the phrase for a dependency on other's vertices, if these depend on those of the mesh; otherwise ''."""
        return phrase if self._depends_on_mesh(other) else ""

    def _depends_on_mesh(self, other):
        """Whether the vertices of an object depend on those of the mesh; False if visited before."""
        if other == self._ob:
            return True
        if not self._is_new(other, 'shape'):
            return False
        settings = other.detail_deform
        followed = settings.transfer.source if settings.transfer.live else None
        if settings.signature and settings.base == 'OBJECT':
            followed = settings.base_object
        if followed is not None and self._depends_on_mesh(followed):
            return True
        return any(self._uses_mesh(modifier) for modifier in other.modifiers)

    def _uses_mesh(self, modifier):
        """Whether an object that a modifier refers to depends on the vertices of the mesh."""
        used = [getattr(modifier, prop.identifier) for prop in modifier.bl_rna.properties if prop.type == 'POINTER']
        return any(hasattr(other, 'modifiers') and bool(self._depends_on_mesh(other) or self.through_transform(other))
                   for other in used)
