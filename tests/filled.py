"""Messages of pymavlink's with something in them."""

from pymavlink.dialects.v20 import development as dialect


def example(number_of_kind, kept):
    """One of pymavlink's messages, whose fields are zero but for the first on the wire. Halves and small whole numbers
    are the same in every type.
    """
    kind = dialect.mavlink_map[number_of_kind]
    values, number = {}, 1
    for name, length in zip(kind.ordered_fieldnames, kind.lengths, strict=True):
        field = kind.fieldtypes[kind.fieldnames.index(name)]
        given = [(number + place if "int" in field else -0.5 * (number + place)) for place in range(length)]
        given = [value if number <= kept else 0 for value in given]
        values[name] = b"NAME" if field == "char" else given[0] if length == 1 else given
        number += length
    return kind(**values)
