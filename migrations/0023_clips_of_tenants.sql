-- Finds the clips of a tenant in a state. The expression is the part of the home's key before its id: tenant/, or nothing for the
-- tenant 'default'. It is no column, so the clips that processes of earlier versions insert are in the index, too.
CREATE INDEX clips_of_tenant ON clips (
    RTRIM(home_id, 'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-'), state, id, updated_at
);
