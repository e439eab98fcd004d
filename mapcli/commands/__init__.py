"""The words the user types, one file each: parse, load, call, save."""
