(** The certificate, and a program that checks it: [check] expands the identity, gives each
    monomial a canonical form under relabelling of the joints and conjugation, adds up like
    monomials, and sees that every coefficient is zero. Soundness.v proves that a certificate
    which passes excludes all solutions. No property of [canonical_labelling] is needed for
    that: a bad choice of labels could only make [check] refuse a true identity. *)
From Coq Require Import ZArith List Bool.
Import ListNotations.

Definition edge := (nat * nat)%type.

(** The product of the W_ij over the edges in [w] and of the conj(W_ij) over those in [wbar] *)
Record monomial := Monomial { w : list edge; wbar : list edge }.
Definition polynomial := list (Z * monomial).

Inductive equation :=
| RowSum (i : nat)        (* sum_k W_ik = 0 *)
| Square (i j : nat)      (* sum_k W_ik W_kj = 0 *)
| TightFrame (i j : nat). (* 7 sum_k (W_ik conj(W_kj) + conj(W_ik) W_kj) = 28 delta_ij - 4 *)

(** Meaning: the average of sum weight |polynomial|^2 + constant
    - sum coefficient monomial equation over the orders of the joints is identically zero. *)
Record certificate := Certificate {
  constant : Z;
  squares : list (Z * polynomial);
  multipliers : list (Z * monomial * equation)
}.

Definition joints := seq 0 7.

(** Expansion *)

Definition one := Monomial [] [].
Definition conjugate (m : monomial) := Monomial (wbar m) (w m).
Definition times (m n : monomial) := Monomial (w m ++ w n) (wbar m ++ wbar n).

Definition scaled (c : Z) (m : monomial) (p : polynomial) : polynomial :=
  map (fun t => (c * fst t, times m (snd t))%Z) p.

Definition squared (p : polynomial) : polynomial :=
  flat_map (fun t => scaled (fst t) (conjugate (snd t)) p) p.

Definition left_side (e : equation) : polynomial :=
  match e with
  | RowSum i => map (fun k => (1%Z, Monomial [(i, k)] [])) joints
  | Square i j => map (fun k => (1%Z, Monomial [(i, k); (k, j)] [])) joints
  | TightFrame i j =>
      map (fun k => (7%Z, Monomial [(i, k)] [(k, j)])) joints
      ++ map (fun k => (7%Z, Monomial [(k, j)] [(i, k)])) joints
      ++ [((if Nat.eqb i j then -24 else 4)%Z, one)]
  end.

Definition expanded (c : certificate) : polynomial :=
  (constant c, one)
  :: flat_map (fun s => scaled (fst s) one (squared (snd s))) (squares c)
  ++ flat_map (fun t => let '(a, m, e) := t in scaled (- a)%Z m (left_side e)) (multipliers c).

(** An order of the monomials, by which equal ones are found *)

Definition compare_edge (a b : edge) : comparison :=
  match Nat.compare (fst a) (fst b) with
  | Eq => Nat.compare (snd a) (snd b)
  | c => c
  end.

Fixpoint compare_edges (a b : list edge) : comparison :=
  match a, b with
  | [], [] => Eq
  | [], _ => Lt
  | _, [] => Gt
  | x :: a, y :: b => match compare_edge x y with Eq => compare_edges a b | c => c end
  end.

Definition compare_monomial (m n : monomial) : comparison :=
  match compare_edges (w m) (w n) with
  | Eq => compare_edges (wbar m) (wbar n)
  | c => c
  end.

(** Like monomials are added up in a binary search tree. *)

Inductive tree := Leaf | Node (left : tree) (m : monomial) (c : Z) (right : tree).

Fixpoint add (c : Z) (m : monomial) (t : tree) : tree :=
  match t with
  | Leaf => Node Leaf m c Leaf
  | Node l n d r =>
      match compare_monomial m n with
      | Eq => Node l n (c + d)%Z r
      | Lt => Node (add c m l) n d r
      | Gt => Node l n d (add c m r)
      end
  end.

Definition collect (p : polynomial) : tree := fold_right (fun t s => add (fst t) (snd t) s) Leaf p.

Fixpoint terms (t : tree) : polynomial :=
  match t with Leaf => [] | Node l m c r => terms l ++ (c, m) :: terms r end.

Definition size (t : tree) := length (terms t).

(** Sorting the edges, relabelling the joints *)

Definition ascending (e : edge) : edge :=
  if Nat.leb (fst e) (snd e) then e else (snd e, fst e).

Fixpoint insert (e : edge) (l : list edge) : list edge :=
  match l with
  | [] => [e]
  | f :: l' => match compare_edge e f with Gt => f :: insert e l' | _ => e :: l end
  end.

Definition sorted_edges (l : list edge) := fold_right (fun e s => insert (ascending e) s) [] l.
Definition sorted (m : monomial) := Monomial (sorted_edges (w m)) (sorted_edges (wbar m)).

Definition relabel_edge (labels : list nat) (e : edge) : edge :=
  (nth (fst e) labels 0, nth (snd e) labels 0).
Definition relabel (labels : list nat) (m : monomial) :=
  Monomial (map (relabel_edge labels) (w m)) (map (relabel_edge labels) (wbar m)).

Definition is_permutation (labels : list nat) : bool :=
  Nat.eqb (length labels) 7 && forallb (fun i => existsb (Nat.eqb i) labels) joints.

Definition edge_on_joints (e : edge) : bool := Nat.ltb (fst e) 7 && Nat.ltb (snd e) 7.
Definition on_joints (m : monomial) : bool :=
  forallb edge_on_joints (w m) && forallb edge_on_joints (wbar m).

Definition on_diagonal (e : edge) : bool := Nat.eqb (fst e) (snd e).
Definition vanishes (m : monomial) : bool := existsb on_diagonal (w m) || existsb on_diagonal (wbar m).

(** A canonical labelling: joints are put into cells by an invariant, found by two steps of
    colour refinement, and all orders within the cells are tried. *)

Definition hash (colour h : Z) : Z := (h * h + 37 * colour * h + 11 * colour)%Z.

Definition neighbours (colour : Z) (l : list edge) (h : list Z) (v : nat) : Z :=
  fold_right (fun e s =>
    (if Nat.eqb (fst e) v then hash colour (nth (snd e) h 0%Z) + s
     else if Nat.eqb (snd e) v then hash colour (nth (fst e) h 0%Z) + s
     else s)%Z) 0%Z l.

Definition refine (m : monomial) (h : list Z) : list Z :=
  map (fun v => (neighbours 1 (w m) h v + neighbours 2 (wbar m) h v)%Z) joints.

Definition vertex_invariants (m : monomial) : list Z :=
  refine m (refine m (map (fun _ => 0%Z) joints)).

(** Cells of joints with equal invariants, in increasing order. A joint without edges, whose
    invariant is 0, gets a cell of its own. *)
Fixpoint insert_cell (invariant : Z) (v : nat) (cells : list (Z * list nat)) : list (Z * list nat) :=
  match cells with
  | [] => [(invariant, [v])]
  | (x, c) :: rest =>
      match Z.compare invariant x with
      | Eq => (x, v :: c) :: rest
      | Lt => (invariant, [v]) :: cells
      | Gt => (x, c) :: insert_cell invariant v rest
      end
  end.

Definition cells (h : list Z) : list (Z * list nat) :=
  fold_right (fun v s =>
    let x := nth v h 0%Z in
    insert_cell (if Z.eqb x 0 then (- Z.of_nat v)%Z else x) v s) [] joints.

(** Cells of a monomial and of its conjugate are compared by invariants and sizes. *)
Fixpoint compare_cells (a b : list (Z * list nat)) : comparison :=
  match a, b with
  | (x, c) :: a, (y, d) :: b =>
      match Z.compare x y with
      | Eq => match Nat.compare (length c) (length d) with Eq => compare_cells a b | r => r end
      | r => r
      end
  | _, _ => Eq
  end.

Fixpoint inserted {A} (x : A) (l : list A) : list (list A) :=
  match l with
  | [] => [[x]]
  | y :: l' => (x :: l) :: map (cons y) (inserted x l')
  end.

Fixpoint orderings {A} (l : list A) : list (list A) :=
  match l with [] => [[]] | x :: l' => flat_map (inserted x) (orderings l') end.

Fixpoint arrangements (c : list (list nat)) : list (list nat) :=
  match c with
  | [] => [[]]
  | x :: c' => let rest := arrangements c' in
               flat_map (fun o => map (fun r => o ++ r) rest) (orderings x)
  end.

Fixpoint position (v : nat) (l : list nat) : nat :=
  match l with [] => 0 | x :: l' => if Nat.eqb v x then 0 else S (position v l') end.

Definition candidates (c : list (Z * list nat)) : list (list nat) :=
  map (fun o => map (fun v => position v o) joints) (arrangements (map snd c)).

Definition smaller (a b : bool * list nat * monomial) :=
  match compare_monomial (snd a) (snd b) with Gt => b | _ => a end.

Definition canonical_labelling (m : monomial) : bool * list nat :=
  let permutations swap m c := map (fun labels => (swap, labels, sorted (relabel labels m))) (candidates c) in
  let c := cells (vertex_invariants m) in
  let d := cells (vertex_invariants (conjugate m)) in
  let all := match compare_cells c d with
             | Lt => permutations false m c
             | Gt => permutations true (conjugate m) d
             | Eq => permutations false m c ++ permutations true (conjugate m) d
             end in
  match all with
  | [] => (false, [])
  | first :: others => fst (fold_left smaller others first)
  end.

Definition canonical (m : monomial) : monomial :=
  let '(swap, labels) := canonical_labelling m in
  if is_permutation labels && on_joints m
  then sorted (relabel labels (if swap then conjugate m else m))
  else m.

(** The check *)

Definition well_formed (e : equation) : bool :=
  match e with
  | RowSum i => Nat.ltb i 7
  | Square i j | TightFrame i j => Nat.ltb i 7 && Nat.ltb j 7
  end.

Definition normal_form (m : monomial) : monomial :=
  let n := sorted m in
  match compare_monomial n (conjugate n) with Gt => conjugate n | _ => n end.

Definition normalise (p : polynomial) : polynomial :=
  map (fun t => (fst t, normal_form (snd t))) (filter (fun t => negb (vanishes (snd t))) p).

Definition remaining (c : certificate) : polynomial :=
  terms (collect (map (fun t => (fst t, canonical (snd t)))
    (terms (collect (normalise (expanded c)))))).

Definition check (c : certificate) : bool :=
  Z.ltb 0 (constant c)
  && forallb (fun s => Z.leb 0 (fst s)) (squares c)
  && forallb (fun t => well_formed (snd t)) (multipliers c)
  && forallb (fun t => Z.eqb (fst t) 0) (remaining c).
