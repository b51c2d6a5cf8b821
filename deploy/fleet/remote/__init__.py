"""Access to other machines over ssh: commands, wheel, keys, journals. No Zenoh sessions and no user output here."""
