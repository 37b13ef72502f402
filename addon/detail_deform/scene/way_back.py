# SPDX-License-Identifier: GPL-3.0-or-later
"""Detects feedback loops: an empty whose place depends on the surface that it moves is moved on by each update."""

_VERTEX_PARENTS = {'VERTEX', 'VERTEX_3'}


class Search:
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

    def of_place(self, other):
        """A phrase that names the dependency of an object's place on the vertices of the mesh; '' if there is none, or
        the object was visited before. The mesh's own place is no dependency, as handles are relative to it."""
        if other == self._ob or not self._is_new(other, 'place'):
            return ""
        bones = other.pose.bones if other.pose else ()
        return (self._of_parent(other) or self._of_constraints(other, other.constraints)
                or next(filter(None, (self._of_constraints(other, bone.constraints) for bone in bones)), ""))

    def _of_parent(self, other):
        if other.parent is None:
            return ""
        if other.parent_type in _VERTEX_PARENTS:
            return self._shape(other.parent, f"'{other.name}' is parented to vertices")
        return self.of_place(other.parent)

    def _of_constraints(self, owner, constraints):
        for constraint in constraints:
            target = getattr(constraint, 'target', None)
            if target is None or constraint.mute or not constraint.influence:
                continue
            by_shape = constraint.type == 'SHRINKWRAP' or (
                target.type == 'MESH' and getattr(constraint, 'subtarget', ""))
            said = f"constraint '{constraint.name}' of '{owner.name}'"
            found = self._shape(target, said) if by_shape else self.of_place(target)
            if found:
                return found
        return ""

    def _shape(self, other, said):
        """said, the phrase for a dependency on other's vertices, if these depend on those of the mesh; otherwise ''."""
        return said if self._is_shaped(other) else ""

    def _is_shaped(self, other):
        """Whether the vertices of an object depend on those of the mesh; False if visited before."""
        if other == self._ob:
            return True
        if not self._is_new(other, 'shape'):
            return False
        settings = other.detail_deform
        followed = settings.transfer.source if settings.transfer.live else None
        if settings.signature and settings.base == 'OBJECT':
            followed = settings.base_object
        if followed is not None and self._is_shaped(followed):
            return True
        for modifier in other.modifiers:
            for prop in modifier.bl_rna.properties:
                if prop.type == 'POINTER':
                    used = getattr(modifier, prop.identifier)
                    if hasattr(used, 'modifiers') and (self._is_shaped(used) or self.of_place(used)):
                        return True
        return False
