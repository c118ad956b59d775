//! What outlives a session: the journal of hits and MCAP recordings.
