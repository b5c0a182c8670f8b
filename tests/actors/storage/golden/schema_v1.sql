-- A database that schema version 1 made: what a later version must open and bring up to date.
CREATE TABLE meta(name TEXT PRIMARY KEY, value INTEGER NOT NULL) STRICT, WITHOUT ROWID;
INSERT INTO meta VALUES('next_row_id',4);
INSERT INTO meta VALUES('own_agent',1);
CREATE TABLE team_agent(agent_id INTEGER PRIMARY KEY) STRICT;
INSERT INTO team_agent VALUES(1);
INSERT INTO team_agent VALUES(2);
CREATE TABLE have_interval(
  origin INTEGER NOT NULL, epoch INTEGER NOT NULL, data_type INTEGER NOT NULL, is_dropped INTEGER NOT NULL,
  first INTEGER NOT NULL, last INTEGER NOT NULL,
  PRIMARY KEY(origin, epoch, data_type, is_dropped, first)) STRICT, WITHOUT ROWID;
INSERT INTO have_interval VALUES(1,292045459138361,1,0,2,2);
INSERT INTO have_interval VALUES(1,292045459138361,1,1,1,1);
INSERT INTO have_interval VALUES(1,292045459138361,20,0,1,1);
CREATE TABLE peer_have(
  peer INTEGER NOT NULL, origin INTEGER NOT NULL, epoch INTEGER NOT NULL, data_type INTEGER NOT NULL,
  first INTEGER NOT NULL, last INTEGER NOT NULL,
  PRIMARY KEY(peer, origin, epoch, data_type, first)) STRICT, WITHOUT ROWID;
CREATE TABLE handed_over(
  peer INTEGER NOT NULL, origin INTEGER NOT NULL, epoch INTEGER NOT NULL, data_type INTEGER NOT NULL,
  seq INTEGER NOT NULL,
  PRIMARY KEY(peer, origin, epoch, data_type, seq)) STRICT, WITHOUT ROWID;
CREATE TABLE role_history(
  row_id INTEGER PRIMARY KEY, term_number INTEGER NOT NULL, leader INTEGER NOT NULL, survivor INTEGER NOT NULL,
  stamp_ns INTEGER NOT NULL, content BLOB NOT NULL) STRICT;
INSERT INTO role_history VALUES(1,1,1,0,1795244150064949694,X'0a0d080110011913832082c40fb976100121be29b8f90afde9182a137374617274206f6620746865206c6561646572');
CREATE TABLE temperature(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,celsius REAL NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
INSERT INTO temperature VALUES(2,1,292045459138361,2,1795244150228364389,'','',-5591390931913271470,-41.5,X'0965ac75030bfde9185209090000000000c044c0');
CREATE TABLE power(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,battery_ratio REAL NOT NULL, draw_w REAL NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE awake_status(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,is_awake INTEGER NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE mode(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,activity INTEGER NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE health(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,level INTEGER NOT NULL, text TEXT NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE exploration(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,explored_ratio REAL NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE distributed_measurements(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,completed_ratio REAL NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE pose_graph_node(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,node_agent INTEGER NOT NULL, node_index INTEGER NOT NULL, x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL,qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, qw REAL NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
INSERT INTO pose_graph_node VALUES(3,1,292045459138361,1,1795244150241635443,'','1:0',4635415913748123033,1,0,1.0,0.0,0.0,0.0,0.0,0.0,1.0,X'09732c40040bfde918f2011c0a02080112160a0909000000000000f03f120921000000000000f03f');
CREATE TABLE pose_graph_edge(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,from_agent INTEGER NOT NULL, from_index INTEGER NOT NULL, to_agent INTEGER NOT NULL, to_index INTEGER NOT NULL,is_range INTEGER NOT NULL, range_m REAL, variance_m2 REAL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE optimized_pose(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,node_agent INTEGER NOT NULL, node_index INTEGER NOT NULL, term_number INTEGER NOT NULL,term_issuer INTEGER NOT NULL, term_issuer_epoch INTEGER NOT NULL, run INTEGER NOT NULL, x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL,qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, qw REAL NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE edge_verdict(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,from_agent INTEGER NOT NULL, from_index INTEGER NOT NULL, to_agent INTEGER NOT NULL, to_index INTEGER NOT NULL,is_range INTEGER NOT NULL, is_inlier INTEGER NOT NULL, residual_sigmas REAL NOT NULL,term_number INTEGER NOT NULL, term_issuer INTEGER NOT NULL, term_issuer_epoch INTEGER NOT NULL,run INTEGER NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE TABLE local_traversability_map(row_id INTEGER PRIMARY KEY, origin INTEGER NOT NULL, epoch INTEGER, seq INTEGER, stamp_ns INTEGER NOT NULL,latest_key TEXT NOT NULL, natural_key TEXT NOT NULL, hash INTEGER NOT NULL,node_agent INTEGER NOT NULL, node_index INTEGER NOT NULL, layer_count INTEGER NOT NULL,finest_resolution_um INTEGER NOT NULL, finest_width_cells INTEGER NOT NULL,finest_height_cells INTEGER NOT NULL, x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL,qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, qw REAL NOT NULL, content BLOB NOT NULL, CHECK((epoch IS NULL) = (seq IS NULL)), UNIQUE(origin, epoch, seq)) STRICT;
CREATE INDEX pose_graph_node_natural ON pose_graph_node(natural_key, origin);
CREATE INDEX pose_graph_edge_natural ON pose_graph_edge(natural_key, origin);
CREATE INDEX optimized_pose_latest ON optimized_pose(latest_key, origin);
CREATE INDEX edge_verdict_latest ON edge_verdict(latest_key, origin);
CREATE VIEW shared_record AS SELECT 1 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM temperature WHERE seq IS NOT NULL UNION ALL SELECT 2 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM power WHERE seq IS NOT NULL UNION ALL SELECT 3 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM awake_status WHERE seq IS NOT NULL UNION ALL SELECT 4 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM mode WHERE seq IS NOT NULL UNION ALL SELECT 5 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM health WHERE seq IS NOT NULL UNION ALL SELECT 10 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM exploration WHERE seq IS NOT NULL UNION ALL SELECT 11 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM distributed_measurements WHERE seq IS NOT NULL UNION ALL SELECT 20 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM pose_graph_node WHERE seq IS NOT NULL UNION ALL SELECT 21 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM pose_graph_edge WHERE seq IS NOT NULL UNION ALL SELECT 22 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM optimized_pose WHERE seq IS NOT NULL UNION ALL SELECT 23 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM edge_verdict WHERE seq IS NOT NULL UNION ALL SELECT 30 AS data_type, row_id, origin, epoch, seq, stamp_ns FROM local_traversability_map WHERE seq IS NOT NULL;
CREATE VIEW replica AS
  SELECT printf('%d.%016x.%d.%d', origin, epoch, data_type, seq) AS replica_id, origin AS agent_id
  FROM shared_record;
CREATE VIEW replication_log AS
  SELECT replica_id, agent_id, destination_id, sent_status, ack FROM (
    SELECT printf('%d.%016x.%d.%d', r.origin, r.epoch, r.data_type, r.seq) AS replica_id, r.origin AS agent_id,
      d.agent_id AS destination_id,
      EXISTS(SELECT 1 FROM handed_over h WHERE h.peer = d.agent_id AND h.origin = r.origin AND h.epoch = r.epoch
             AND h.data_type = r.data_type AND h.seq = r.seq) AS sent_status,
      EXISTS(SELECT 1 FROM peer_have p WHERE p.peer = d.agent_id AND p.origin = r.origin AND p.epoch = r.epoch
             AND p.data_type = r.data_type AND r.seq BETWEEN p.first AND p.last) AS ack
    FROM shared_record r CROSS JOIN team_agent d
    WHERE d.agent_id <> (SELECT value FROM meta WHERE name = 'own_agent'))
  WHERE sent_status OR ack
  UNION ALL
  SELECT printf('%d.%016x.%d.%d', origin, epoch, data_type, seq), origin, own.value, 0, 1
  FROM shared_record CROSS JOIN meta own
  WHERE own.name = 'own_agent' AND origin <> own.value;
CREATE VIEW v_node_pose AS
  WITH raw AS (
    SELECT *, row_number() OVER (PARTITION BY node_agent, node_index
      ORDER BY epoch IS NULL, origin, epoch < 0, epoch, seq, row_id) AS place FROM pose_graph_node),
  best AS (
    SELECT *, row_number() OVER (PARTITION BY node_agent, node_index
      ORDER BY term_number < 0 DESC, term_number DESC, term_issuer DESC, term_issuer_epoch < 0 DESC,
        term_issuer_epoch DESC, run < 0 DESC, run DESC, row_id DESC) AS place FROM optimized_pose)
  SELECT raw.node_agent, raw.node_index, raw.stamp_ns, best.row_id IS NOT NULL AS is_optimized,
    COALESCE(best.x, raw.x) AS x, COALESCE(best.y, raw.y) AS y, COALESCE(best.z, raw.z) AS z,
    COALESCE(best.qx, raw.qx) AS qx, COALESCE(best.qy, raw.qy) AS qy, COALESCE(best.qz, raw.qz) AS qz,
    COALESCE(best.qw, raw.qw) AS qw
  FROM raw LEFT JOIN best
    ON best.node_agent = raw.node_agent AND best.node_index = raw.node_index AND best.place = 1
  WHERE raw.place = 1;
PRAGMA user_version=1;
