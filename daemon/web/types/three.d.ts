// three.js has no types of its own: what is drawn with it is not checked, what is handed to it is.
declare namespace THREE {
  type Group = any;
  type Mesh = any;
}
declare const THREE: any;
export = THREE;
